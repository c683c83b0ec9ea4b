"""The knowledge base through which robots share recipes, object models, maps, self-models and experience.

``entries`` defines the data and the interface of stores; ``sqlite_store`` is a store in one file.
``axioms`` extracts the OWL 2 EL part of an ontology, ``completion`` draws the conclusions, and ``descriptions`` holds
those about one entry; ``questions`` parses class expressions, ``index`` answers them over all entries.
``client`` talks to a server over HTTP (:mod:`executive.serving`): ``connection`` sends requests and caches responses,
``answers`` parses them; ``pulling`` downloads entries to a folder, ``pulled`` recognises them there.
"""
