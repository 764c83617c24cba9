"""The wall between a body and those who decide: agent and verifier play in a process of their own, or at a URL.

Requests are JSON-RPC 2.0, one a line over a pipe or one a POST; docs/wall.md describes them. messages: values to JSON
and back. session: the deciders' side. links: pipe and URL. deciders: the body's side.
"""
