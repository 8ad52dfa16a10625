"""The commands: each reads a study or a file, calls what works, prints and returns the exit code.

`shared.command` makes a command of a function; cli lists them. Everything heavy is imported when a
command needs it, so that help and errors come at once. Faults of the user are raised
(tcstudy.errors.UserFault) and printed by cli.

Not here: catching faults and missing memory (cli), anything that computes or makes files (study),
sentences on results (reports).
"""
