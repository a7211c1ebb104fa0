"""Filters, observers and identification: from records to parameters and states with their uncertainty."""
