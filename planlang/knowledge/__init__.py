"""The knowledge base through which robots share recipes, object models, maps, self-models and experience.

General layout: ``entries`` says what is kept and how it is asked for; ``sqlite_store`` keeps it in one file.
``axioms`` reads what an ontology says in OWL 2 EL, ``completion`` draws the conclusions, ``descriptions`` keeps what an
entry adds; ``questions`` reads class expressions, ``index`` answers them over all entries.
``client`` asks a server over HTTP (:mod:`executive.serving`): ``connection`` sends requests and keeps what was read,
``answers`` reads what a server says; ``pulling`` writes entries into a folder, ``pulled`` knows them there again.
"""
