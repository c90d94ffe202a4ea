"""Elements of XML, the faults of a file, and joints that follow others: what the readers of robot files share."""
