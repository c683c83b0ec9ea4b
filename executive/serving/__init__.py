"""The server of a knowledge base: HTTP and web page in front of a store."""
