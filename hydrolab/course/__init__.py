"""What the course needs beside the library: notebooks kept fresh, drawings, explorers, answers to
predictions.
"""
