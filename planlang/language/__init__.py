"""The plan language: what plans are written with. Each construct stands on the kernel; its module says what it does."""
