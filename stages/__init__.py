"""DVC stages: each reads its configuration and inputs, makes one library call, writes its outputs."""

import os
import sys
from types import TracebackType

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # threads that wait sleep; read when torch is loaded


def _end(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """End quietly after Ctrl-C, as `user_errors` does, also while a stage's module is being imported."""
    if issubclass(kind, KeyboardInterrupt):
        raise SystemExit(130)
    sys.__excepthook__(kind, error, trace)


sys.excepthook = _end
