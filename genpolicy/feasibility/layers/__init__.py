"""The layers as margins: one file each, one function `margins(batch, cell)` of one meaning.

A margin is limit minus value, one number per check and chunk: the smallest over rows and joints.
A check passes where its margin is >= 0; a margin that cannot be computed is NaN and never passes.
"""
