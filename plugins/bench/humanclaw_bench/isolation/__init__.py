"""Isolation of agents: agent and verifier play in a process of their own.

Requests are JSON, one a line over a pipe. messages: values to JSON and back. session: the agents' side. transports:
the pipe. agents: the body's side.
"""
