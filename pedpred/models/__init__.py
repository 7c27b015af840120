"""The learned models: what each reads, computes and is trained on, in a folder of its own."""
