"""What each command takes and does: read a study or a file, call what works, print what it says,
return the exit code.

`shared.command` makes a command of a function; cli lists them. Everything heavy is imported
when a command needs it, so that help and errors come at once. What the user can mend is raised
(tcstudy.errors.UserFault) and said by cli.

Not here: catching faults and memory (cli), anything that computes (study) or words a result
(reports).
"""
