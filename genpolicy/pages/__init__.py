"""HTML pages: style, figures, and the page of the audit."""
