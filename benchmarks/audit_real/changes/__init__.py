"""What people do to recordings, each change with what becomes true by it."""
