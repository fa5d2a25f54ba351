"""Fields: from stress tensors to a scalar field whose isocurves follow the tension."""
