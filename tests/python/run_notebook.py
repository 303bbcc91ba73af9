"""Runs a notebook in a folder and fails where one of its cells does: run_notebook.py NOTEBOOK FOLDER."""

import sys

import nbclient
import nbformat

notebook = nbformat.read(sys.argv[1], as_version=4)
nbclient.NotebookClient(notebook, timeout=240, resources={"metadata": {"path": sys.argv[2]}}).execute()
