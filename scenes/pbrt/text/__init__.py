"""From bytes to directives with their parameters: pbrt-v4's lexical level and grammar."""
