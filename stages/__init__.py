"""DVC stages: each reads its configuration and inputs, makes one library call, writes its outputs."""

import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # threads that wait sleep; read when torch is loaded
