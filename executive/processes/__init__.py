"""Worker processes for computations that may hang, run out of memory or crash: forked warm, limited, replaced."""
