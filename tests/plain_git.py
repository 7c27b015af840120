"""Settings of git under which tests make repositories, whatever those of the user are."""

import os

_SETTINGS = {
    "commit.gpgSign": "false",
    "core.autocrlf": "false",
    "core.excludesFile": os.devnull,
    "core.hooksPath": os.devnull,
    "init.templateDir": "",
}

PLAIN_GIT = {"GIT_CONFIG_COUNT": str(len(_SETTINGS))}
"""Variables of the environment; what else a user has set, such as `safe.directory`, stays."""
for _number, (_name, _value) in enumerate(_SETTINGS.items()):
    PLAIN_GIT |= {f"GIT_CONFIG_KEY_{_number}": _name, f"GIT_CONFIG_VALUE_{_number}": _value}
