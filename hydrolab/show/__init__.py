"""What people see: readings in words, figures that carry them, explorers and the machine in 3D."""
