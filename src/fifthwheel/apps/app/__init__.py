"""The workbench: pages in a browser for the way from a log to the identified truck, on the functions of `workflow`.

`serve.serve(folder)` starts the server. Everything that a user does is in the files of a folder, the `Workspace`:

    logs/             logs, as dropped
    databases/        DBC and ARXML files
    signals.toml      the signal map
    vehicle.toml      the vehicle file
    workspace.toml    the choices: which logs are used, windows that are excluded, settings of the identification
    runs/<name>/      result folders, each as `fifthwheel identify --out` writes it
    .workbench/       versions for undo, and the samples of the logs in a form that is quick to plot

`pages.BUILDERS` has the function that fills each page. It is called for each tab, with a `Workspace` of its own.

- A page reads the documents from `workspace` and changes them by `workspace.write({name: text}, label)` only, which
  is atomic, can be undone, and raises `StaleError` where another tab has changed them since this tab has read them.
- An exception in a handler is shown, and a stale tab reloads (`layout.frame`); a page handles no errors of its own.
- Computation is not done on the event loop: `await jobs.compute(function, ...)` for what takes up to some seconds, and
  `jobs.start(key, function, ...)` for what has progress and can be cancelled; `layout.show_progress(key)` shows it.
  A job belongs to the server, so that it continues when a tab is closed or reloaded.
- `runs.records(folder)` gives the records of the logs that are used, without excluded windows; it is for `jobs`:
  `jobs.start("identify", function, workspace.folder)` with a function that calls it in the process.
- Messages and reports name settings by `base.spelling`; the server and its jobs spell them as questions of the pages.
- `documents.show(*blocks)` shows blocks of a `Document`, `documents.show_plot(plot)` a `Plot`.
- On a telephone a page has at most 1500 px: `layout.part(title)` is for what is not its first answer.
- After a change that other parts of a page depend on, use `ui.refreshable`. Nothing is kept in a page only.
"""
