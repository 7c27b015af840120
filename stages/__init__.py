"""DVC stages: each reads its configuration and inputs, makes one library call, writes its outputs."""
