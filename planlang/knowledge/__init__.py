"""The knowledge base through which robots share recipes, object models, maps, self-models and experience.

General layout: ``entries`` says what is kept and ``stores`` how it is asked for; ``sqlite_store`` keeps it in one file.
``descriptions`` reads from an ontology what an entry is about, ``index`` answers class expressions over descriptions.
``client`` asks a server over HTTP (:mod:`executive.serving`), and keeps what it was given.
"""
