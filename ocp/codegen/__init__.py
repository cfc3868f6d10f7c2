"""C from CasADi expressions: printing, partial evaluation, compiling."""
