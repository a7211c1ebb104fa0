"""The live page: plots, a drawing of the truck, parameters."""
