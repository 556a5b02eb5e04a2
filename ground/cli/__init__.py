"""The commands of `ground`, one file each."""
