"""The peg in a hole with half a millimetre of play: contact, search, and at times no post."""
