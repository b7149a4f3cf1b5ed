// decoder.js - the worker that decodes meshes.
import {decompress} from 'fzstd';
self.onmessage = event => self.postMessage(decompress(event.data));
