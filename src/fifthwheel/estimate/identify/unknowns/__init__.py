"""What an identification estimates or allows for: the unknowns, each with its prior and bounds."""
