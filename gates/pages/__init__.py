"""Reports for people: HTML and Markdown, drawn from the JSON report and the evidence tables."""
