"""Commands for mechanisms: run, simulate, trace, plot, modes, energies, equations."""
