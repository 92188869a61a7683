"""Gate A, need: does one observation truly admit several valid actions?"""
