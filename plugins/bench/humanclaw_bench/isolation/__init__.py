"""Isolation of agents: agent and verifier play in a process of their own.

Requests are JSON-RPC 2.0, one a line over a pipe; docs/isolation.md describes them. messages: values to JSON
and back. session: the deciders' side. transports: the pipe. deciders: the body's side.
"""
