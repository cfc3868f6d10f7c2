"""Design of motor angles for driven joints."""
