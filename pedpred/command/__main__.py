"""`python -m pedpred.command` is the command `pedpred`."""

from pedpred.command import main

main()
