"""Studies: published work reproduced with this package."""
