"""The audit as one page for a person: audit.html, drawn from audit.json and the evidence."""
