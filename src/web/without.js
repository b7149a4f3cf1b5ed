// without.js - what the page says where the viewer could not be built (bundle.sh).
if (typeof document !== 'undefined')
    document.body.textContent =
        'This rqt was built without its viewer: node, npm or the npm registry was missing. Install them and run make again. ' +
        'All else answers: /collections lists the terrains, /openapi.json tells what can be asked.';
