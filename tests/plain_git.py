"""Settings of git under which tests make repositories, whatever those of the user are."""

import os
import subprocess
from pathlib import Path

_SETTINGS = {
    "commit.gpgSign": "false",
    "core.autocrlf": "false",
    "core.excludesFile": os.devnull,
    "core.hooksPath": os.devnull,
    "init.templateDir": "",
    "user.email": "tests@localhost",
    "user.name": "tests",
}

PLAIN_GIT = {"GIT_CONFIG_COUNT": str(len(_SETTINGS))}
"""Variables of the environment; what else a user has set, such as `safe.directory`, stays."""
for _number, (_name, _value) in enumerate(_SETTINGS.items()):
    PLAIN_GIT |= {f"GIT_CONFIG_KEY_{_number}": _name, f"GIT_CONFIG_VALUE_{_number}": _value}


def git(folder: Path, *commands: str) -> None:
    """Run commands of git, each a text of words."""
    for command in commands:
        subprocess.run(["git", *command.split()], cwd=folder, check=True)
