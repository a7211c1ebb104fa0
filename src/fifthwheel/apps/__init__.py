"""What people and machines start: command line, workbench, live node, fleet, studies, the article."""
