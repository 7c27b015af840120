"""How programs write that there is no value."""

_NO_VALUE = (
    "nan +nan -nan nan(ind) -nan(ind) -1.#ind 1.#ind 1.#qnan na n/a #n/a #na #nan <na> nat null #null! "
    "none nil missing #value! #num! #div/0! #ref! - -- . ?"
)
MISSING = {"", *_NO_VALUE.split()}
"""In small letters."""
