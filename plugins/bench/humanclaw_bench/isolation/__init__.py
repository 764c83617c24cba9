"""Isolation of agents: agent and verifier play in a process of their own.

Requests are JSON, one a line over a pipe. messages: values to JSON and back. session: the deciders' side. transports:
the pipe. deciders: the body's side.
"""
