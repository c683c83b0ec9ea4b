"""Recipe files of the corpus, by name: tests ask something of each, and are skipped where the corpus is absent."""

RECIPES = (
    "ChocolateCakeBaking@2011-03.owl",
    "GetFromRefrigerator@2010-11.owl",
    "TableSetting@2011-10.owl.in",
    "acat-adt_example_pipetting@master.owl",
    "exploration-recipe@hydro.owl",
    "make_pancakes@hydro.owl",
    "object-search-recipe@hydro.owl",
    "pancake-making-constr@hydro.owl",
    "pancake-making@groovy_2011-08.owl.in",
    "pancake-making@hydro.owl",
    "pancake@kinetic.owl",
    "pouring@hydro.owl",
    "serve_drink@knowrob_hydro_2014-11.owl",
    "serve_drink@re_stack.owl",
    "serve_drink_new@re_stack.owl",
)
