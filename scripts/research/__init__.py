"""Developer tools: the paper's study, benchmarks, and makers of assets and pictures. Not part of any wheel."""
