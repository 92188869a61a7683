"""How often is the audit right on recordings as others bring them? See `docs/audit-real.md`."""
