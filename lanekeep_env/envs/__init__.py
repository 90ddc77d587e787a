"""Environment classes: thin skins, single and vectorised, over one compiled kernel a family."""
