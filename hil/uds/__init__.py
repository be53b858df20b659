"""Unified diagnostic services (ISO 14229-1) from the tester's side: their words, their messages in logs, a client."""
