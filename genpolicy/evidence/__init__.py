"""What the stages of each gate measure; nothing here decides."""
