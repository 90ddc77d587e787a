"""Whether the results in a folder are what its policies drive: files, episodes driven again, and fresh ones."""
