"""JSON documents as dataclasses, and those that stages below the audit write."""
