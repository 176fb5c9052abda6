"""Sensors of robots: functions (block, addresses, group) that a step calls; may import `swarm`, `cells` and below."""
