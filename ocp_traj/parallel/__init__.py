"""Work that can be done elsewhere: jobs, and who does them: this process, others of this machine, or a cluster."""
