"""What is read: study files, and result files, the seam to the solvers."""
