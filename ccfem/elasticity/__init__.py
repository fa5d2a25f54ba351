"""Linear elasticity on tetrahedra: problem, assembly, solvers, recovery."""
