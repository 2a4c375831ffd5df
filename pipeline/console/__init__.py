"""The parts that commands share: their declaration, their options, and the console."""
