"""Task plug-ins; nothing outside a task knows what it manipulates."""
