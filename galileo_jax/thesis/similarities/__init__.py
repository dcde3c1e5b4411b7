"""The scores of `--preset thesis`: one file each, named as the similarity."""
