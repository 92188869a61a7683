"""The default task: round a post on either side, then insert a peg."""
