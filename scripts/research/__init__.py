"""What users do not run: the paper's study, benchmarks, and the makers of assets and pictures. No wheel has it."""
