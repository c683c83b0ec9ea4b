"""Processes that compute what may take too long, need too much memory or crash: forked warm, limited, replaced."""
