// Compiles a job of extras/flamenco/hemibake.js as the Flamenco Manager does, with a stub of what it offers to
// job types; node flamenco_job.js SCRIPT prints the job type and the tasks of the settings on standard input, as JSON.

const fs = require("fs");
const vm = require("vm");

class Task {
    constructor(name, type) {
        if (!name.trim() || !type.trim()) throw new Error("a task needs a name and a type");
        Object.assign(this, { name, type, commands: [], dependencies: [] });
    }
    addCommand(command) { this.commands.push(command); }
    addDependency(task) { this.dependencies.push(task.name); }
}

const tasks = [];
const job = {
    settings: JSON.parse(fs.readFileSync(0, "utf8")),
    created: new Date(2026, 0, 2, 3, 4, 5),
    addTask: task => tasks.push({ ...task, commands: [...task.commands] }),
};

// The Manager joins and takes paths apart for both / and \.
const path = {
    join: (...parts) => parts.join("/"),
    stem: name => name.split(/[\\/]/).pop().replace(/\.[^.]*$/, ""),
};
const author = {
    Task: (name, type) => new Task(name, type),
    Command: (name, parameters, steps = 0) => ({ name, parameters, steps }),
};
const offered = vm.createContext({
    author,
    path,
    formatTimestampLocal: () => "2026-01-02_030405",
    shellSplit: text => (text.match(/"[^"]*"|\S+/g) || []).map(word => word.replace(/"/g, "")),
});
vm.runInContext(fs.readFileSync(process.argv[2], "utf8"), offered);
offered.job = job;
const type = vm.runInContext("compileJob(job); JOB_TYPE", offered);
process.stdout.write(JSON.stringify({ type, settings: job.settings, tasks }));
