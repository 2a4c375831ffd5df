"""The parts that commands share: their declaration, options, the scene they are asked for, and the
console.
"""
