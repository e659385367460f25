"""Which law: how much of a workspace a leaf covers, the best leaf of a workspace, advice for a robot and its work."""
