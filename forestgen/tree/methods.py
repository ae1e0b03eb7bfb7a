"""Methods: the only file that names all the papers. A method is one strategy a stage."""
